declare const URDFLoader: any;
export default URDFLoader;
